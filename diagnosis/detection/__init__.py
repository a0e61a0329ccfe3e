"""Is there a gap? Noise, hum, comparable runs, and the tests against chance."""
