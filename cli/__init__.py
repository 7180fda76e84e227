"""firable.cli"""
