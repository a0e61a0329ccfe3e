"""An independent reference simulator: the truth of blind checks and an oracle for the rest.

Pure NumPy. It shares no numerics with the MuJoCo model, the estimators or the diagnosis: another integrator
(all runs of many campaigns advance together), another friction law (a stick-slip event with the state
corrected inside the step), and for every family of effects further forms than the textbook one.

``conditions`` says what a campaign is, ``integrator`` moves it, ``moments`` and ``readings`` hold the laws,
``forms`` and ``outside`` catalogue them, ``severity`` sizes them against the noise, ``draw`` draws campaigns
and ``make`` writes them: ``python -m tunnel_reference.make OUT --count N --seed S``.
"""
