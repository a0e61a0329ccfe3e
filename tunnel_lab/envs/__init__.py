"""Gymnasium environments that need identification and diagnosis; `tunnel_sim.envs` registers them.

Nothing is imported here: gymnasium and the engine load with `tunnel_lab.envs.campaign` alone.
"""
