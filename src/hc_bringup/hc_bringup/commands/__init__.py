"""The subcommands of hc, one module each: HELP, configure(parser), run(arguments)."""
