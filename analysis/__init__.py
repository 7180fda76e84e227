"""firable.analysis"""
