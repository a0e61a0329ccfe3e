"""A run shown: as a film, as a picture, live in a window or in a browser.

``live``, ``window``, ``web`` and ``stepper`` load the engine; ``request`` and ``film`` do not.
"""
