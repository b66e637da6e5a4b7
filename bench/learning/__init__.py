"""Learning on the task of navigation and light following, and recovery from damage."""
