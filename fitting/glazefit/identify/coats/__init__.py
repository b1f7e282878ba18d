"""Is a film a mixture, or one paint over another?"""
