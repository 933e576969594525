/* @NAME@: a formula; see @NAME@.h. */
#include "@NAME@.h"

#include <math.h>

typedef @NAME@_real real;

void @NAME@_predict(const @NAME@_signals *s, @NAME@_real y[@NAME_UPPER@_OUTPUTS])
{
    (void)s;
@BODY@
}
@LIFT@
