"""firable.semantics"""
