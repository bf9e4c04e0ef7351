
/* y = weight x + bias */
static inline void model_affine(int outputs, int inputs, const float *weight, const float *bias,
        const model_real *x, model_real *y)
{
    int i, k;
    for (i = 0; i < outputs; i++) {
        y[i] = (model_real)bias[i];
        for (k = 0; k < inputs; k++)
            y[i] += (model_real)weight[i * inputs + k] * x[k];
    }
}

/* The derivatives of y from those of x, one row of numbers for each. */
static inline void model_linear(int outputs, int inputs, const float *weight, const model_real *dx,
        model_real *dy)
{
    int i, k, c;
    for (i = 0; i < outputs; i++)
        for (c = 0; c < MODEL_COLUMNS; c++) {
            model_real sum = 0;
            for (k = 0; k < inputs; k++)
                sum += (model_real)weight[i * inputs + k] * dx[k * MODEL_COLUMNS + c];
            dy[i * MODEL_COLUMNS + c] = sum;
        }
}

/* max(y, 0) */
static inline void model_relu(int outputs, model_real *y)
{
    int i;
    for (i = 0; i < outputs; i++)
        y[i] = model_max(y[i], 0);
}

/* The derivatives of max(y, 0). */
static inline void model_relu_linear(int outputs, const model_real *y, model_real *dy)
{
    int i, c;
    for (i = 0; i < outputs; i++)
        for (c = 0; y[i] <= 0 && c < MODEL_COLUMNS; c++)
            dy[i * MODEL_COLUMNS + c] = 0;
}
