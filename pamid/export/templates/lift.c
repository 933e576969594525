
void @NAME@_elements(const @NAME@_drive *drive, @NAME@_real element[3])
{
    (void)drive;
@ELEMENTS@
}

/* Implicit in the damping, explicit in the stiffness, with steps of at most a fifth of the swing's 1/omega and 1 ms. */
int @NAME@_step(@NAME@_lift *lift, const @NAME@_drive *from, const @NAME@_drive *to, @NAME@_real load, @NAME@_real dt)
{
    const real length = @REST_LENGTH@, top = @TOP@, weight = load * @GRAVITY@;
    real a[3], b[3], x = length * lift->eps, v = length * lift->deps, h;
    long i, n, swing;
    int held = 0;
    @NAME@_elements(from, a);
    @NAME@_elements(to, b);
    swing = (long)ceil(sqrt((double)((a[1] > b[1] ? a[1] : b[1]) / load)) * (double)dt / 0.2);
    n = (long)ceil((double)dt / 1e-3);
    n = n > swing ? n : swing;
    n = n > 1 ? n : 1;
    h = dt / (real)n;
    for (i = 0; i < n; i++) {
        const real s = ((real)i + (real)0.5) / (real)n;
        const real force = a[0] + s * (b[0] - a[0]), stiff = a[1] + s * (b[1] - a[1]), damp = a[2] + s * (b[2] - a[2]);
        v = (v + h * (force - weight - stiff * x) / load) / (1 + h * damp / load);
        x += h * v;
        if (x < 0) {
            x = 0;
            v = v > 0 ? v : 0;
        } else if (x > top) {
            x = top;
            v = v < 0 ? v : 0;
            held = 1;
        }
    }
    lift->eps = x / length;
    lift->deps = v / length;
    return held;
}
