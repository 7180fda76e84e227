"""firable.decompose"""
