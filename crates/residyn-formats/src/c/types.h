#include <math.h>

/* MODEL_(x): a number or a function of math.h in the type chosen. */
#ifdef MODEL_FLOAT
typedef float model_real;
#define MODEL_(x) x##f
#else
typedef double model_real;
#define MODEL_(x) x
#endif

