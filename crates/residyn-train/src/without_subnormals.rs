use burn::optim::{Adam, AdamState, AdamW, AdamWState, AdaptiveMomentumState, Optimizer};
use burn::tensor::{Device, Tensor};

/// Number of steps after which subnormal moments are set to zero.
const EVERY: usize = 32;

/// Adam without subnormal moments. The moments of a weight whose gradient stays zero, as behind a ReLU that no row
/// activates, would decay into the subnormal range, where processors are slow.
#[derive(Debug, Clone)]
pub(super) struct WithoutSubnormals<O>(pub O);

/// A state with Adam's moments.
trait HasMoments<const D: usize> {
    fn moments(&mut self) -> &mut AdaptiveMomentumState<D>;

    fn without_subnormals(mut self) -> Self
    where
        Self: Sized,
    {
        let moments = self.moments();
        if moments.time.is_multiple_of(EVERY) {
            for moment in [&mut moments.moment_1, &mut moments.moment_2] {
                let subnormal = moment.clone().abs().lower_scalar(f32::MIN_POSITIVE);
                *moment = moment.clone().mask_fill(subnormal, 0.0);
            }
        }
        self
    }
}

macro_rules! without_subnormals {
    ($($optimizer:ident, $state:ident;)*) => {$(
        impl<const D: usize> HasMoments<D> for $state<D> {
            fn moments(&mut self) -> &mut AdaptiveMomentumState<D> {
                &mut self.momentum
            }
        }

        impl Optimizer for WithoutSubnormals<$optimizer> {
            type State<const D: usize> = $state<D>;

            fn step<const D: usize>(
                &self,
                rate: f64,
                tensor: Tensor<D>,
                gradient: Tensor<D>,
                state: Option<Self::State<D>>,
            ) -> (Tensor<D>, Option<Self::State<D>>) {
                let (tensor, state) = self.0.step(rate, tensor, gradient, state);
                (tensor, state.map(HasMoments::without_subnormals))
            }

            fn to_device<const D: usize>(state: Self::State<D>, device: &Device) -> Self::State<D> {
                $optimizer::to_device(state, device)
            }
        }
    )*};
}

without_subnormals! {
    Adam, AdamState;
    AdamW, AdamWState;
}
