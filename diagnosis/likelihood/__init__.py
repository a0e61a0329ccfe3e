"""The likelihood of a campaign: its runs in similar units, the model of them, and the fits."""
