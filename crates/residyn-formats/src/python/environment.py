

try:
    import gymnasium
except ImportError:
    gymnasium = None

if gymnasium is not None:

    class Environment(gymnasium.Env):
        """The task under the interface of gymnasium: positions and velocities are observed, torques are actions.

        An action is held for the task's own step, in whole steps of the model. Episodes never terminate, they are
        truncated after the task's number of steps.
        """

        metadata = {"render_modes": []}

        def __init__(self, parameters=None):
            self.parameters = parameters
            low, high = (np.array(TASK[end]) for end in ("low", "high"))
            self.action_space = gymnasium.spaces.Box(low, high, dtype=np.float64)
            self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2 * JOINTS,), np.float64)
            self.repeats = max(1, round(TASK["hold_s"] / STEP))

        def reset(self, *, seed=None, options=None):
            super().reset(seed=seed)
            spread = self.np_random.uniform(-1.0, 1.0, 2 * JOINTS) * TASK["spread"]
            self.state, self.memory, self.steps = np.concatenate([TASK["start"] + spread, START[2 * JOINTS :]]), None, 0
            return self.state[: 2 * JOINTS].copy(), {}

        def step(self, action):
            for k in range(self.repeats):
                time = (self.steps * self.repeats + k) * STEP
                self.state, self.memory = step(self.state, action, self.memory, time, self.parameters)
            self.steps += 1
            won = float(reward(self.state, action, self.steps * self.repeats * STEP))
            return self.state[: 2 * JOINTS].copy(), won, False, self.steps >= TASK["steps"], {}
