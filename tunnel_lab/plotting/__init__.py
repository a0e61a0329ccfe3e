"""Figures of campaigns and estimates."""
