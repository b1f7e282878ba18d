"""Tables, sentences and pictures of recoveries and predictions."""
