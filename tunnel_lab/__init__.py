"""The laboratory over the rig: command line, tables and figures.

Importing this package or ``tunnel_lab.cli`` imports neither MuJoCo, torch, matplotlib nor SciPy; each command
imports its dependencies when it runs, so that ``tunnel --help`` answers at once.
"""
