"""The manual: a package, for its files have names that others have, too."""
