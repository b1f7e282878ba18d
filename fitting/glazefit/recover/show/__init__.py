"""What recoveries and predictions say: tables, sentences, pictures."""
