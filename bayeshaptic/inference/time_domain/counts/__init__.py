"""The counts of one mass, each as likely as those before it make it: what is fitted to them."""
