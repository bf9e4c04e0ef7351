
static inline model_real model_sign(model_real x)
{
    return x > 0 ? 1 : x < 0 ? -1 : x;
}

static inline model_real model_min(model_real a, model_real b)
{
    return a < b || a != a ? a : b;
}

static inline model_real model_max(model_real a, model_real b)
{
    return a > b || a != a ? a : b;
}
