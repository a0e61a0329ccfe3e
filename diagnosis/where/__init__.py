"""Where the nominal model departs from the runs."""
