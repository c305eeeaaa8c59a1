"""Looking ahead on a walk: cells that the eye may reach, items that it may need, and which of them to hold."""
