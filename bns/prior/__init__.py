"""What is known of a robot before its trials: repertoires, and models that err."""
