"""Reading and writing: campaigns, run files and plans, each checked, each written whole or not at all."""
