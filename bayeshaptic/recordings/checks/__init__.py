"""Whether a recording can be used: what is wrong with it, in doubt, or too little."""
