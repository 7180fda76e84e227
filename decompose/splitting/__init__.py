"""Splitting a net over its controllers: subnets, the coordinator table, and what the split needs to know."""
