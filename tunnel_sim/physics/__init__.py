"""The physics of one run: the moment law, the motion it gives, and the steps it is integrated in."""
