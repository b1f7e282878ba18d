"""The command `glazejax`: its forward sub-commands, what they compute and how they show it."""
