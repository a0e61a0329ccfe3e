"""The virtual rig: its description, its MuJoCo model and plugin, and the records it gives.

Importing this package imports neither MuJoCo nor Gymnasium. Only ``tunnel_sim.engine`` and ``tunnel_sim.envs``
need them.
"""
