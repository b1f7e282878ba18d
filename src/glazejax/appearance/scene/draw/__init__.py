"""The ray caster: rays through the pixels of a scene, what they meet, and its light."""
