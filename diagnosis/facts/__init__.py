"""What a diagnosis finds, as frozen values with their units: its document and its words are made of them."""
