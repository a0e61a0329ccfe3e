"""The paper's two networks: their inputs, their training and their use.

The first, 100-5-5-1, gives the damping ratio from three cycles of a free decay. The second, 2-2-5-1, gives the
natural frequency from that ratio and the duration t3 of the three cycles. Training needs torch; use needs only
NumPy. The network of `neural_posterior` weighs rival linear models (`rivals`) of demodulated runs
(`demodulated`).
"""
