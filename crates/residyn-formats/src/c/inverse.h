
/* Inverse dynamics: the torques that a motion needs beyond those that act. Where no effect depends on the torque, with none
 * acting they are those that the motion needs. */
static inline void model_inverse_dynamics(const model_parameters *parameters,
        const model_real state[MODEL_STATES],
        const model_real acceleration[MODEL_JOINTS],
        const model_real torque[MODEL_JOINTS], model_real time,
        model_real needed[MODEL_JOINTS])
{
    (void)parameters, (void)state, (void)acceleration, (void)torque, (void)time;
NEEDED
}
