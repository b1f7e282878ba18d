"""The studio's page: its solver and how quickly it answers."""
