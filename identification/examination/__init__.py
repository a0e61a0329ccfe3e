"""What happens to a campaign before anything is estimated from it, for every command alike."""
