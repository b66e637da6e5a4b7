"""The claims of the dissertation: what is settled, and how they are tested."""
