"""The commands of ``tunnel``, kindred ones in one file; the docstring of a command's function is its help text.

What a command needs it imports inside the function, so that the command line starts at once.
"""
