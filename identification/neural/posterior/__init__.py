"""The network of `neural_posterior`: rival linear models of demodulated runs, weighed by a trained network.

``demodulated`` reduces a record to windows of envelope and phase. ``shapes`` lists what rival models add to them,
and ``rivals`` fits every rival by generalised least squares. ``network`` gives each rival a weight and a width, and
``mixture`` is the posterior that follows.
"""
