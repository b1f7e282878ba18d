"""What makes shipped data and pictures, and measures nothing."""
