"""Time integration in many styles, sound and unsound, for `motion_solvers.Solver`."""


class Schemes:
    """Methods named after what `scheme` says; each does a step of dt."""

    def _flow(self, dt):
        """Continuity: densities by the latest velocities."""
        if self.density == "continuity":
            self._accelerate(self.X, self.V)
            self.R = self.R + dt * self.drho

    def _euler(self, dt):
        A = self._accelerate(self.X, self.V)
        self.V = self.V + dt * A * (0.5 if self.fault == "half kick" else 1)
        self.X = self.X + dt * (self.V + self._smooth(self.V)) * (
            0.5 if self.fault == "half drift" else 1
        )
        self._flow(dt)

    def _old_density(self, dt):
        """Continuity with the velocities from before the kick."""
        A = self._accelerate(self.X, self.V)
        self._flow(dt)
        self.V = self.V + dt * A
        self.X = self.X + dt * (self.V + self._smooth(self.V))

    def _drift_first(self, dt):
        self.X = self.X + dt * (self.V + self._smooth(self.V))
        self._flow(dt)
        self.V = self.V + dt * self._accelerate(self.X, self.V)

    def _kdk(self, dt):
        self.V = self.V + dt / 2 * self.A
        self.X = self.X + dt * (self.V + self._smooth(self.V))
        self._flow(dt)
        self.A = self._accelerate(self.X, self.V)
        self.V = self.V + dt / 2 * self.A

    def _dkd(self, dt):
        self.X = self.X + dt / 2 * (self.V + self._smooth(self.V))
        self._flow(dt / 2)
        self.V = self.V + dt * self._accelerate(self.X, self.V)
        self.X = self.X + dt / 2 * (self.V + self._smooth(self.V))
        self._flow(dt / 2)

    def _half(self, dt):
        """Leapfrog whose v is half a step behind x."""
        A = self._accelerate(self.X, self.V)
        self.V = self.V + (dt if self.steps else dt / 2) * A
        self.X = self.X + dt * self.V
        self._flow(dt)

    def _verlet(self, dt):
        """Stoermer-Verlet on positions, with central velocities."""
        A = self._accelerate(self.X, self.V)
        if self.before is None:
            self.before = self.X - dt * self.V + dt**2 / 2 * A
        X = 2 * self.X - self.before + dt**2 * A
        self.V = (X - self.before) / (2 * dt)
        self.before, self.X = self.X, X

    def _midpoint(self, dt):
        """Predictor-corrector: half a step with the last accelerations, then the whole."""
        xm, vm, R = self.X + dt / 2 * self.V, self.V + dt / 2 * self.A, self.R
        if self.density == "continuity":
            self._accelerate(self.X, self.V)
            self.R = R + dt / 2 * self.drho
        self.A = self._accelerate(xm, vm)
        if self.density == "continuity":
            self.R = R + dt * self.drho
        old, self.V = self.V, self.V + dt * self.A
        self.X = self.X + dt * ((old + self.V) / 2 + self._smooth(vm))

    def _heun(self, dt):
        R = self.R
        A = self._accelerate(self.X, self.V)
        if self.density == "continuity":
            first = self.drho
            self.R = R + dt * first
        xe, ve = self.X + dt * self.V, self.V + dt * A
        B = self._accelerate(xe, ve)
        if self.density == "continuity":
            self.R = R + dt / 2 * (first + self.drho)
        self.X = self.X + dt / 2 * (self.V + ve)
        self.V = self.V + dt / 2 * (A + B)

    def _substeps(self, dt):
        for _ in range(3):
            self._euler(dt / 3)

    def _forward(self, dt):
        A = self._accelerate(self.X, self.V)
        self._flow(dt)
        self.X, self.V = self.X + dt * self.V, self.V + dt * A

    def _lagged(self, dt):
        A = self._accelerate(self.X, self.V)
        self.V = self.V + dt * self.A
        self.X = self.X + dt * self.V
        self.A = A
        self._flow(dt)

    def _taylor(self, dt):
        """Velocity Verlet whose second half was forgotten."""
        A = self._accelerate(self.X, self.V)
        self.X, self.V = self.X + dt * self.V + dt**2 / 2 * A, self.V + dt * A
