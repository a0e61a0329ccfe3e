"""An independent reference simulator: the truth of blind checks, and an oracle for tests.

It is pure NumPy and shares no numerics with the MuJoCo model, the estimators or the diagnosis. It has its own
integrator (all runs of many campaigns advance together) and friction law (stick-slip events that correct the state
within the step). For every family of effects it has further forms besides the textbook form.

``conditions`` defines a campaign, ``integrator`` integrates it, ``moments`` and ``readings`` contain the laws,
``inputs`` the inputs of driven runs, ``forms`` and ``outside`` list the effects, ``severity`` scales them relative
to the noise, ``draw`` draws campaigns and ``make`` makes sets of them for ``tunnel blind make``.
"""
