"""The compiled loop over quadrature points: fully implicit radial return for all flow laws.

`calling` is the interface to Python, `loop` the loop over points; `point` reduces strains and
stresses of a point to equivalent ones; `radial_return` solves the remaining scalar problem;
`flow_stress` has the laws, `constants` the columns of their coefficients. Derivatives come from the
same functions, compiled for numbers with a derivative (`dual`). A deviator s has the equivalent
stress q = sqrt(3/2) |s|.

Hardening depends on a strain h. Accumulated: h = R (p + dp), with R = 1 / (1 + dt/tau) for
recovery. Signed: the viscoplastic strain tensor E is the state, e = R sqrt(2/3) E:n its part along
the flow n; h = max(e + R dp, 0) where hardening is a factor. Where it adds (austenite) it is the
back stress X along E, which is subtracted from the trial deviator: the same scalar problem with the
trial |s - X|. n is that of the trial, so that e is known, but it turns with the strain increment:
the tangent gains a term along n (x) E, with `by_old` the derivative of q with respect to e.
"""
