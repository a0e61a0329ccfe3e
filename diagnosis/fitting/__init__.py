"""The model of a campaign as a function of parameters, and its least-squares fit."""
