"""The commands of ``tunnel``, one file each: ``NAME`` and ``run``, whose docstring is the help text.

What a command needs it imports inside ``run``, so that the command line starts at once.
"""
