"""Makes shipped data and pictures, and tries the tests."""
