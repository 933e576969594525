/* A load that hangs at the muscle or rests on its stand: what it remembers from step to step. */
typedef struct {
    @NAME@_real eps;  /* contraction ratio, dimensionless */
    @NAME@_real deps; /* its rate, 1/s */
} @NAME@_lift;

/* What drives it at one instant. */
typedef struct {
    @NAME@_real P;  /* gas pressure, Pa, absolute */
    @NAME@_real dP; /* its rate, Pa/s */
} @NAME@_drive;

/* Force of the contractile element (N), stiffness (N/m) and damping (N s/m). */
void @NAME@_elements(const @NAME@_drive *drive, @NAME@_real element[3]);

/* Move a load (kg) on by dt (s), the drive going straight from one instant to the next. Returns 1 if the lift was held at
 * the edge of the contractions of the fit, 0 if not. The state {0, 0} is a load at rest on its stand. */
int @NAME@_step(@NAME@_lift *lift, const @NAME@_drive *from, const @NAME@_drive *to, @NAME@_real load, @NAME@_real dt);

