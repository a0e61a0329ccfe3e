"""The commands of ``tunnel``, related ones in one file; the docstring of a command's function is its help text.

Commands import inside their functions, for a fast start of the command line.
"""
