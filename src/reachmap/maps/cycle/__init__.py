"""The pick cycle of a bin map: where its seconds go, and where it ends early."""
