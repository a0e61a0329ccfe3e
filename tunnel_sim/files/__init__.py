"""Reading and writing of campaigns, run files, plans and rigs. Input is checked; output is written atomically."""
