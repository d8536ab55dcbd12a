"""The measurements of `zteam bench`: figures of this machine, which no test judges."""
