"""Team files: TOML that is read into structs without unknown keys.

Every error is a ConfigError with one line per mistake: file, line, key, what is wrong and what is allowed.
"""
