/* Functions that FMI 2.0 and 3.0 share. Expects the standard's types as OF(name), Instance and report(). FMU_STATE and
   DESERIALIZE are parts of names that the two spell differently. */

/* The signatures are those of the standard, whether a function needs all arguments or not. */
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

/* Where the code of several FMUs is linked together, names begin with that of the model. */
#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)
#define OF_(name) OF(name)
#ifdef PREFIX
#define FMI_OF(type, name) EXPORT type JOIN(PREFIX, OF_(name))
#else
#define FMI_OF(type, name) EXPORT type OF_(name)
#endif
#define FMI(name) FMI_OF(OF(Status), name)

static Data *data_of(void *instance)
{
    return &((Instance *)instance)->data;
}

/* The status for an error message, or for NULL where there is no error. */
static OF(Status) status(void *instance, const char *message)
{
    if (message)
        report((const Instance *)instance, message);
    return message ? OF(Error) : OF(OK);
}

/* The new instance with its start values; freed if the importer has the description of another unit. */
static Instance *checked(Instance *instance, const char *token)
{
    if (!token || strcmp(token, TOKEN) != 0) {
        report(instance, "the model description is that of another FMU");
        free(instance);
        return NULL;
    }
    reset(&instance->data);
    return instance;
}

FMI(SetDebugLogging)(void *instance, OF(Boolean) on, size_t count, const OF(String) categories[])
{
    return OF(OK);
}

FMI_OF(void, FreeInstance)(void *instance)
{
    free(instance);
}

FMI(ExitInitializationMode)(void *instance)
{
    accept_point(data_of(instance));
    return OF(OK);
}

FMI(Reset)(void *instance)
{
    reset(data_of(instance));
    return OF(OK);
}

#define NOTHING_TO_DO(name) \
    FMI(name)(void *instance) \
    { \
        return OF(OK); \
    }

NOTHING_TO_DO(EnterEventMode)
NOTHING_TO_DO(Terminate)

/* Access to variables of a kind that the unit does not have. */
#define NO_VARIABLES(name, ...) \
    FMI(name)(void *instance, const OF(ValueReference) references[], size_t count, __VA_ARGS__) \
    { \
        return count == 0 ? OF(OK) : OF(Error); \
    }

static const char *const NO_OUTPUT_DERIVATIVES = "outputs come without derivatives";

/* ---- the whole state ---- */

FMI(JOIN(Get, FMU_STATE))(void *instance, void **state)
{
    return status(instance, keep(data_of(instance), state));
}

FMI(JOIN(Set, FMU_STATE))(void *instance, void *state)
{
    memcpy(data_of(instance), state, sizeof(Data));
    return OF(OK);
}

FMI(JOIN(Free, FMU_STATE))(void *instance, void **state)
{
    free(*state);
    *state = NULL;
    return OF(OK);
}

FMI(JOIN(JOIN(Serialized, FMU_STATE), Size))(void *instance, void *state, size_t *size)
{
    *size = sizeof(Data);
    return OF(OK);
}

FMI(JOIN(Serialize, FMU_STATE))(void *instance, void *state, OF(Byte) bytes[], size_t size)
{
    return status(instance, serialise(state, bytes, size));
}

FMI(JOIN(DESERIALIZE, FMU_STATE))(void *instance, const OF(Byte) bytes[], size_t size, void **state)
{
    return status(instance, deserialise(bytes, size, state));
}

/* ---- model exchange ---- */

FMI(EnterContinuousTimeMode)(void *instance)
{
    accept_point(data_of(instance));
    return OF(OK);
}

FMI(CompletedIntegratorStep)(void *instance, OF(Boolean) final, OF(Boolean) *enterEventMode, OF(Boolean) *terminate)
{
    accept_point(data_of(instance));
    *enterEventMode = *terminate = 0;
    return OF(OK);
}

FMI(SetTime)(void *instance, double time)
{
    data_of(instance)->time = time;
    return OF(OK);
}

FMI(SetContinuousStates)(void *instance, const double states[], size_t count)
{
    return status(instance, set_states(data_of(instance), states, count));
}

FMI(GetContinuousStates)(void *instance, double states[], size_t count)
{
    return status(instance, get_states(data_of(instance), states, count));
}

FMI(GetNominalsOfContinuousStates)(void *instance, double nominals[], size_t count)
{
    size_t k;
    for (k = 0; k < count; k++)
        nominals[k] = 1;
    return OF(OK);
}

FMI(GetEventIndicators)(void *instance, double indicators[], size_t count)
{
    return count == 0 ? OF(OK) : OF(Error);
}
