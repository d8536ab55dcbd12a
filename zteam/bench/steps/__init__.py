"""`zteam bench steps`: what a robot's step costs: velocity mux, behaviour and safety layer together."""
