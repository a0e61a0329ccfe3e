"""Shows a run as a film or a picture, or in real time in a window or a browser.

``live``, ``window``, ``web`` and ``stepper`` load the engine; ``request`` and ``film`` do not.
"""
