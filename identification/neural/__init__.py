"""The paper's two networks: their inputs, their training and their use.

The first, 100-5-5-1, reads the damping ratio from three cycles of a free decay; the second, 2-2-5-1, reads the
natural frequency from that ratio and the time t3 the three cycles took. Training runs in torch, use in NumPy alone.
"""
