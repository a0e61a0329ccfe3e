"""What an answer predicts: held-out readings, and its coefficients by linear theory."""
