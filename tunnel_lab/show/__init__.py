"""Shows a run as a film or a picture, or in real time in a window or a browser.

``live`` loads the engine; ``film`` does not.
"""
