"""The page: a net to play with, and a running cell, in a browser on this host.

Its sources are TypeScript, in `web/` at the top of the repository; what is built of them stands in `built/` and is part
of the package, so that whoever installs firable needs no Node. All meaning is here, in Python: which transition may
fire, what it waits for and what comes of it is asked of the one firing rule; the page shows, and knows no rule.
"""
