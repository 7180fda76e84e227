"""firable.executor"""
