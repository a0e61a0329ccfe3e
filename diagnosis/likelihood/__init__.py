"""The likelihood of a campaign: its runs in similar units, their model, and the fits."""
